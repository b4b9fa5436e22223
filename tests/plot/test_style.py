"""Figures look the same whatever settings the user or a folder has, and change none."""

import io

import matplotlib
import pytest

import mopro
from helpers.paths import PROGRAMS
from mopro.emulator.limits import PROFILES, Limit
from mopro.plot.comparison import plot_comparison
from mopro.plot.limits import plot_limits

OTHERS = {
    "text.usetex": True, "font.size": 31.0, "savefig.dpi": 30.0, "axes.facecolor": "red",
    "lines.linewidth": 9.0, "figure.dpi": 20.0, "axes.grid": True, "savefig.transparent": True,
    "xtick.labelsize": 40.0, "svg.fonttype": "none", "axes.formatter.use_mathtext": True,
}  # fmt: skip


@pytest.fixture(scope="module")
def recording():
    return mopro.emulate(mopro.compile("UU012500/1\nVEL1 15.0\nACC1 0.2\nMRI1 0.2\nWX1\n"))


def limits():
    return [Limit(name, v, 100.0, 1.0, 0.3) for name in PROFILES for v in (10.0, 20.0)]


def comparison():
    return mopro.open_experiment(PROGRAMS / "thermal" / "experiment.toml").compare()


FIGURES = {
    "recording": lambda recording: recording.plot(),
    "limits": lambda _: plot_limits(limits(), "10 in"),
    "comparison": lambda _: plot_comparison(comparison(), "the table"),
}


@pytest.mark.parametrize("kind", FIGURES)
def test_a_figure_looks_the_same_under_other_settings(recording, kind):
    def saved():
        figure, image = FIGURES[kind](recording), io.BytesIO()
        figure.savefig(image, format="svg", metadata={"Date": None})
        return figure._repr_png_(), image.tell()

    plain = saved()
    with matplotlib.rc_context(OTHERS):
        before = dict(matplotlib.rcParams)
        assert saved() == plain
        assert dict(matplotlib.rcParams) == before
