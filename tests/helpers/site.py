"""Modules of docs/, which is no package."""

import importlib.util

from helpers.paths import ROOT


def module_of_docs(name):
    """The module docs/`name`.py."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "docs" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
