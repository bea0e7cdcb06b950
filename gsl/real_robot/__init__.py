"""The real robot as a stage sees it: episodes asked for in a request, and taken from its answer."""
