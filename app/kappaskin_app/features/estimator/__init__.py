"""The estimator: method and basis."""
