"""The mutations still fit the code: said here at once, not after an hour of trying them."""

from __future__ import annotations

import pytest

from tests.mutations import MUTATIONS, ROOT, Mutation


@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda mutation: mutation.name)
def test_its_text_and_its_tests_are_there(mutation: Mutation) -> None:
    assert (ROOT / mutation.file).read_text().count(mutation.old) == 1
    assert mutation.new != mutation.old
    for test in mutation.tests:
        file, _, function = test.partition("::")
        source = (ROOT / file).read_text()
        assert not function or f"def {function.partition('[')[0]}(" in source
