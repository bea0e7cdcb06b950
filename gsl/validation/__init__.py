"""Is a grounding good enough to search in? Checks before a search, and what each found."""
