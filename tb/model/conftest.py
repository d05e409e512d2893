"""Fixtures that several model tests share."""

from __future__ import annotations

import pytest
from chip_samples import prepared_view


@pytest.fixture(scope="session")
def prepared():
    """See `prepared_view`."""
    return prepared_view()
