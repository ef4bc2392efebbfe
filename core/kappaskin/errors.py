"""What the library raises when it cannot do what was asked."""


class Refusal(ValueError):
    """A question that cannot be answered as put.

    The text says what was expected, what came and what to do; the command line prints it and
    exits with 2, the app shows it in the panel that asked.
    """


class RankDeficient(Refusal):
    """The readings do not determine the coefficients asked for."""


class SourceError(Refusal):
    """A source cannot be opened, stopped answering, or speaks something else."""


class Damaged(Refusal):
    """A file is not whole, and a repair may save what is."""
