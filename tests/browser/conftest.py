import os
from collections.abc import Iterator

import pytest

from tests.browser.chromium import Page, executable, open_browser


@pytest.fixture(scope="session")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    program = executable()
    if program is None:
        reason = "no Chromium in the path: `make browser` installs it where apt-get may"
        if os.environ.get("BROWSER_REQUIRED"):
            pytest.fail(reason)
        pytest.skip(reason)
    with open_browser(program, tmp_path_factory.mktemp("profile")) as opened:
        yield opened
