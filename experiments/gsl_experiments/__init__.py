"""Studies: what many iterations come to, as the tables and figures of the paper."""
