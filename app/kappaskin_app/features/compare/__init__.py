"""Two setups on the same readings."""
