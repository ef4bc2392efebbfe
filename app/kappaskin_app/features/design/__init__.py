"""Design of a sensor before it is built."""
