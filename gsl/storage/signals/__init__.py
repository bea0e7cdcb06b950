"""What looks wrong in recorded signals, seen without a simulator: by the import and by the audit."""
