"""What stands in, beside a robot, for the parts of gsl that need more than numpy: no validation, no compiler."""
