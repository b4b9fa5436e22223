"""The passes of the diagnosis: each a function from one state to the next.

`PASSES` is all that is done between the question and the verdict, in this order. A loop takes the
passes that stand in it. A pass works on a copy of its state, and the trace of a verdict tells what
each of them did.
"""

from mopro.engine.passes.alternatives import find_alternatives, from_alternatives
from mopro.engine.passes.drafts import examine_remainder, set_laws_apart, something_is_left
from mopro.engine.passes.drop import (
    drop_outweighed,
    eliminate,
    hold_out,
    hold_out_again,
)
from mopro.engine.passes.find import add_laws, search_catalogue, settle
from mopro.engine.passes.loops import Loop, Pass, a_pass, in_turn, until_stable, where
from mopro.engine.passes.odd_run import find_odd_run, in_one_run, keep_what_others_bear
from mopro.engine.passes.samples import (
    refine_steps,
    restate_quiet_noise,
    set_ends_aside,
    set_wild_aside,
)
from mopro.engine.passes.stand_ins import expose_beside_drafts, expose_stand_ins

__all__ = ["PASSES", "Loop", "Pass", "a_pass", "in_turn", "until_stable", "where"]

# What one of these drops may be what another one was satisfied with.
DROP = until_stable(expose_stand_ins, drop_outweighed, hold_out)

ANSWER = from_alternatives(
    # Find what explains the data. A search begins anew where the data or the model changed.
    set_ends_aside,
    search_catalogue,
    set_wild_aside,
    search_catalogue,
    refine_steps,
    search_catalogue,
    add_laws,
    restate_quiet_noise,
    search_catalogue,
    add_laws,
    # Doubt it.
    settle,
    eliminate,
    DROP,
    # Tell what is known.
    set_laws_apart,
    expose_beside_drafts,
    where(something_is_left, eliminate, drop_outweighed, hold_out),
    hold_out_again,
    find_alternatives,
    examine_remainder,
)

PASSES: tuple[Pass, ...] = (ANSWER, find_odd_run, in_one_run(ANSWER), keep_what_others_bear)
