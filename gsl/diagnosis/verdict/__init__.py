"""What the evidence allows to say, and with which probability."""
