"""The features: one folder for each thing a person does."""
