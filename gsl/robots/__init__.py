"""Robots: one file of sourced constants each, and what is derived from them."""
