"""Between the command line and the stages: overrides, composition, help, completion, messages."""
