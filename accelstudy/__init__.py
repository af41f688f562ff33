"""Monte Carlo study of the calibration of tri-axial accelerometers for leveling."""


def __getattr__(name: str) -> str:
    """Version of the package; looked up when asked for, since that takes long."""
    if name != "__version__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib.metadata import version

    return version(__name__)
