"""The corpus: small specs, each with something that a post can get wrong."""

from __future__ import annotations

from pathlib import Path

from drillc.driver import Planned, plan_spec
from drillc.language.diagnostics import Report
from drillc.language.job import Emit, Named, Setting
from drillc.output.acceptance import mapped_joints
from drillc.output.post import PostProcessor

_FOLDER = Path(__file__).parent / "corpus"

#: The names of all programs, which are those of the specs in the folder `corpus`.
PROGRAMS = tuple(sorted(path.stem for path in _FOLDER.glob("*.drill")))
#: Programs of this kind are split, by posts that can, into modules of so many holes.
_SPLIT, _MODULE_HOLES = "_modules", 4


def planned(name: str) -> Planned:
    """A program of the corpus, before any post. Raises KeyError."""
    if name not in PROGRAMS:
        raise KeyError(name)
    return plan_spec(_FOLDER / f"{name}.drill", _FOLDER, Report())


def emit_for(post: PostProcessor, name: str, plan: Planned) -> Emit:
    """The `emit` of a program: joints, where the post asks for them, are mapped to its last axes,
    in order; all settings are left as they are, but for the size of modules."""
    span = plan.job.program.span
    joints = mapped_joints(plan.programs[0], post.accepts)
    targets = post.accepts.axes[-len(joints) :] if joints else ()
    axes = tuple((Named(j, span), Named(a, span)) for j, a in zip(joints, targets, strict=False))
    settings: tuple[Setting, ...] = ()
    if name.endswith(_SPLIT) and post.split_files:
        settings = (Setting(Named("holes_per_module", span), float(_MODULE_HOLES), "", span),)
    return Emit(Named(post.name, span), settings, axes)
