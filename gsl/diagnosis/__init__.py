"""Where the gap of sim and real lies, which effect causes it, and how far it shrinks with that effect."""
