"""The paper's figures, each drawn from a run of its own."""
