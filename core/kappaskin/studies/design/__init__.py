"""Design studies: a scene, what of it is varied, and how accurate the estimates are then."""
