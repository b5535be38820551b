"""PlatformIO's runner for the firmware's unit tests: doctest, and no test is a failure.

PlatformIO's own doctest runner fetches doctest from the registry even for `pio run`, and
counts nothing where a test program prints only its failures.
"""

from __future__ import annotations

from pathlib import Path

from platformio.exception import UserSideException
from platformio.test.runners.doctest import DoctestTestRunner

HEADERS = (Path("/usr/include/doctest/doctest.h"), Path("/usr/local/include/doctest/doctest.h"))


class CustomTestRunner(DoctestTestRunner):  # type: ignore[misc]  # PlatformIO has no types
    """Take the system's doctest where it has one (Debian: doctest-dev)."""

    EXTRA_LIB_DEPS = (
        None if any(path.exists() for path in HEADERS) else DoctestTestRunner.EXTRA_LIB_DEPS
    )

    def setup(self) -> None:
        """Let the program print every test; the runner reads results from what it prints."""
        self.options.program_args = ["--success", "--no-exitcode"]

    def teardown(self) -> None:
        """Refuse a program that ran nothing: PlatformIO would call it passed."""
        if not self.options.without_testing and not self.test_suite.cases:
            raise UserSideException(f"{self.test_suite.test_name}: no test ran")
