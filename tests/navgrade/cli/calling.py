"""Call the command line as a user does, and look at what it leaves behind."""

from __future__ import annotations

import contextlib
import io
import signal
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from numpy.typing import NDArray

from navgrade.cli import main
from tests.navgrade.logmaking import Channel, write_log


@dataclass(frozen=True)
class Outcome:
    """What a command gave back."""

    code: int
    out: str
    err: str


def navgrade(*arguments: object) -> Outcome:
    """Run the command line in this process."""
    out, err = io.StringIO(), io.StringIO()
    handler = signal.getsignal(signal.SIGTERM)
    code: object = None
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            main([str(argument) for argument in arguments])
    except SystemExit as stop:
        code = stop.code
    finally:
        signal.signal(signal.SIGTERM, handler)
    assert isinstance(code, int)
    return Outcome(code, out.getvalue(), err.getvalue())


def one_sentence(outcome: Outcome, *facts: str) -> str:
    """Check that a command was refused in one line holding these facts; return the line."""
    assert outcome.code == 2, outcome
    assert outcome.err.startswith("navgrade: ")
    assert outcome.err.endswith("\n")
    assert outcome.err.count("\n") == 1, f"more than one line: {outcome.err}"
    for fact in facts:
        assert fact in outcome.err, f"{fact!r} is not in: {outcome.err}"
    return outcome.err


class Bench:
    """A folder with a log, a site file and room for an output."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.log = folder / "drive.mcap"
        self.site = folder / "site.toml"
        self.out = folder / "nav.mcap"

    def write(self, *channels: Channel, site: str | None = None, **container: Any) -> Bench:
        """Write the log, and the site file where given."""
        write_log(self.log, *channels, **container)
        if site is not None:
            self.site.write_text(site)
        return self

    def run(self, *options: object) -> Outcome:
        """``navgrade run`` of the log with the site file into the output."""
        return navgrade("run", self.log, "-c", self.site, "-o", self.out, *options)

    def refused(self, *facts: str, options: tuple[object, ...] = ()) -> str:
        """Check that a run gives one sentence and leaves nothing; return the sentence."""
        sentence = one_sentence(self.run(*options), *facts)
        self.left_nothing()
        return sentence

    def accepted(self, *options: object) -> Outcome:
        """Check that a run succeeds."""
        outcome = self.run(*options)
        assert outcome.code == 0, outcome
        assert outcome.err == ""
        assert self.out.is_file()
        assert not self.part.exists()
        return outcome

    @property
    def part(self) -> Path:
        """The half-written output."""
        return self.out.with_name(self.out.name + ".part")

    def left_nothing(self) -> None:
        """Check that there is neither an output nor a part of it."""
        assert not self.out.exists()
        assert not self.part.exists()

    def provenance(self) -> dict[str, str]:
        """The provenance record of the output."""
        with self.out.open("rb") as stream:
            records = {r.name: r.metadata for r in make_reader(stream).iter_metadata()}
        found: dict[str, str] = records["navgrade.provenance"]
        return found

    def messages(self, topic: str = "/navgrade/solution") -> list[Any]:
        """Messages of an output topic, decoded by mcap-ros2-support, checksums verified."""
        with self.out.open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
            return [row.decoded_message for row in reader.iter_decoded_messages(topics=[topic])]

    def stamps_and_status(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Header stamps (ns) and status of the solution."""
        rows = [
            (m.header.stamp.sec * 1_000_000_000 + m.header.stamp.nanosec, m.status)
            for m in self.messages()
        ]
        stamp_ns, status = np.array(rows, np.int64).T
        return stamp_ns, status
