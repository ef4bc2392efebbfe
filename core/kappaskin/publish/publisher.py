"""What sends messages: one small interface, one file for each transport."""

from dataclasses import dataclass
from typing import Protocol

from kappaskin.publish.message import Message, State


@dataclass(frozen=True)
class Receiver:
    """Who is sent to: messages `sent` and `dropped`, and why the last of these was."""

    name: str
    sent: int = 0
    dropped: int = 0
    trouble: str = ""


class Publisher(Protocol):
    """Sends what is estimated to those who receive it.

    No call waits for a receiver: what one does not take at once is dropped and counted.
    """

    @property
    def receivers(self) -> tuple[Receiver, ...]: ...

    @property
    def counts(self) -> tuple[int, int]:
        """Messages sent and dropped, with those of receivers that have gone."""
        ...

    def send(self, message: Message) -> None:
        """Send what one frame says."""
        ...

    def tell(self, state: State) -> None:
        """Send how the source is doing; called several times a second."""
        ...

    def close(self) -> None: ...
