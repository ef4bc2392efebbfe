"""Hard cases, each run through every method that claims it, with a verdict on each answer."""
