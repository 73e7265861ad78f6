"""How tests run: property tests without a deadline per example (the first may compile the model); the loop in here."""

from collections.abc import Iterator

import pytest
from hypothesis import settings

settings.register_profile("suite", deadline=None)
settings.register_profile("fuzz", settings.get_profile("suite"), max_examples=1000)
settings.load_profile("suite")


@pytest.fixture(autouse=True, scope="session")
def one_process() -> Iterator[None]:
    """Keep the loop in the test's own process: the tests share the cores already. Its own tests say otherwise."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("rig.loop.workers.hold.cores", lambda: 1)
        yield
