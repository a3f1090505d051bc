"""A scheduler of schedulers (section 4.3.5): groups of requesters, with another scheduler among the groups."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fusesoc_firm.scheduling.models.base import Bools, Ints, Scheduler


class Combined(Scheduler):
    """A combined scheduler: a group requests if its granted requester does, and only the chosen group sees beats.

    The requesters of the first group in `groups` have the lowest indices. `top` has one requester for each group.
    Raises `ValueError` if the number of groups or the sizes of the batches do not match.
    """

    def __init__(self, groups: Sequence[Scheduler], top: Scheduler) -> None:
        sizes = [group.requesters for group in groups]
        super().__init__(top.batch, sum(sizes))
        if top.requesters != len(groups) or any(group.batch != top.batch for group in groups):
            raise ValueError(
                f"the scheduler has {top.requesters} requesters and {len(groups)} groups; legal: one group for each"
                " requester, and the same batch size in all groups"
            )
        self._groups = groups
        self._top = top
        self._first = np.cumsum([0, *sizes[:-1]])

    def step(self, request: Bools, beat: Bools, last: Bools) -> None:
        """See `Scheduler`."""
        chosen = self._top.grant_select
        group_request = np.empty((self.batch, len(self._groups)), np.bool_)
        for place, group in enumerate(self._groups):
            first = self._first[place]
            of_group = request[:, first : first + group.requesters]
            group_request[:, place] = group.grant_valid & of_group[self._members, group.grant_select]
            group.step(of_group, beat & (chosen == place), last)
        self._top.step(group_request, beat, last)
        self.grant_valid = self._top.grant_valid
        selected: Ints = np.stack([group.grant_select for group in self._groups], axis=1) + self._first
        self.grant_select = selected[self._members, self._top.grant_select]
