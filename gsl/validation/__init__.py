"""Is a grounding good enough to search in? Checks before a search, and what each found.

Importing the room makes the check of every kind known to `gsl.validation.gate.examine`.
"""

from gsl.validation import effects, gat, randomised, servo, torque_noise  # noqa: F401
