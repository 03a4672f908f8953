"""A claim about a publisher that hears of its first listener while it still asks for one."""

from __future__ import annotations

import contextlib
import tempfile
import threading
from pathlib import Path
from typing import Any

import pytest
import zenoh

from lodeline.bus import Publisher
from lodeline.sessions import Client, Hub, Peer


class LateAnswer:
    """A session whose publishers get the answer to that question late: first the news, then it."""

    def __init__(self, session: zenoh.Session, news: threading.Event) -> None:
        self._session, self._news = session, news
        self.answers: list[bool] = []

    def declare_publisher(self, key: str, **more: Any) -> Any:
        self._publisher = self._session.declare_publisher(key, **more)
        return self

    @property
    def matching_status(self) -> Any:
        status: Any = self._publisher.matching_status
        self._news.wait(0.5)
        self.answers.append(status.matching)
        return status

    def __getattr__(self, name: str) -> Any:
        return getattr(self._publisher, name)


def test_news_of_a_listener_are_not_undone_by_an_older_answer(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    news = threading.Event()
    before = Publisher._matching

    def matching(publisher: Publisher, status: zenoh.MatchingStatus) -> None:
        before(publisher, status)
        news.set()

    monkeypatch.setattr(Publisher, "_matching", matching)
    answers: list[bool] = []
    with tempfile.TemporaryDirectory(prefix="ll") as folder, contextlib.ExitStack() as ends:
        sessions = [Hub(Path(folder)), reader := Peer(Path(folder), "reader")]
        for session in sessions:
            ends.callback(session.close)
        reader.subscribe("some/wheels", 4, lambda *_: None)
        for _ in range(5):
            news.clear()
            client = Client(Path(folder))
            ends.callback(client.close)
            late = LateAnswer(client._session, news)
            publisher = Publisher(late, "some/wheels", "")  # type: ignore[arg-type]
            answers += late.answers
            assert publisher.watched
    assert False in answers, "else nothing was older"
