"""`python -m gsl` is the command line."""

from gsl.cli import main

main()
