"""Answers remembered, wherever they were computed."""

from collections.abc import Callable
from typing import Any, Generic, ParamSpec, TypeVar

_Question = ParamSpec("_Question")
_Answer = TypeVar("_Answer")


class Memo(Generic[_Question, _Answer]):
    """Remembers what `answer` said to the last `most` questions; `learn` brings what it would say.

    As `functools.lru_cache`, which learns from nobody.
    """

    def __init__(self, answer: Callable[_Question, _Answer], most: int) -> None:
        self._answer, self._most = answer, most
        self._known: dict[tuple[Any, ...], _Answer] = {}

    def __call__(self, *question: _Question.args, **_: _Question.kwargs) -> _Answer:
        if question not in self._known:
            self.learn(question, self._answer(*question, **_))
        self._known[question] = self._known.pop(question)  # the latest comes last
        return self._known[question]

    def learn(self, question: tuple[Any, ...], answer: _Answer) -> None:
        """Remember that `answer` is what there is to say to `question`."""
        self._known[question] = answer
        if len(self._known) > self._most:
            del self._known[next(iter(self._known))]
