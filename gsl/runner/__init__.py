"""What runs beside a real robot: needs numpy alone, is copied into every request, and acts as gsl's own policies do."""
