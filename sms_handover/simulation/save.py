"""Save the arrays of a run as a NumPy archive."""

from pathlib import Path
from typing import IO, Any

import numpy as np

from sms_handover.errors import ConfigurationError
from sms_handover.run_data import RunData


def save_run(run: RunData, path: Path) -> None:
    """Write the arrays of a run to ``path`` (.npz); those per arm are named ``<field>.<arm>``.

    Raises ConfigurationError if the file exists or cannot be written.
    """
    try:
        with path.open("xb") as file:
            write_arrays(run, file)
    except FileExistsError:
        raise ConfigurationError(f"{path} exists; choose another file") from None
    except OSError as error:
        raise ConfigurationError(f"{path} cannot be written: {error.strerror}") from error


def write_arrays(run: RunData, stream: IO[bytes]) -> None:
    """Write the arrays of a run to a stream, as :func:`save_run` does to a file."""
    arrays: dict[str, Any] = {
        name: value for name, value in vars(run).items() if isinstance(value, np.ndarray)
    }
    for name, per_arm in (("target_pose", run.target_pose), ("tool_pose", run.tool_pose)):
        arrays.update({f"{name}.{arm}": array for arm, array in per_arm.items()})
    arrays["joint_names"] = np.array(run.joint_names)
    np.savez_compressed(stream, **arrays)
