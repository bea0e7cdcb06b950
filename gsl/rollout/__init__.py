"""Rollouts: one, many in parallel, and what they return."""
