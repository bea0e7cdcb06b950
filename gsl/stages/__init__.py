"""One file per subcommand: read, call the components, write."""
