"""dataset.yaml: the setup that all episodes of a data set share."""

from __future__ import annotations

from pathlib import Path

import yaml

from cliport_core.bag_limits import TooMuchError, load_yaml
from cliport_core.whole_file import sync
from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.disk import disk_errors, replace_text
from cliport_episodes.episode_folder import EPISODES, read_own_setup
from cliport_episodes.errors import DataSetError, SetupError

FILE = "dataset.yaml"
FORMAT = 1


def write_setup(data_set: Path, setup: CaptureSetup) -> None:
    """Write dataset.yaml, which makes a folder a data set. Raises DiskError."""
    text = yaml.safe_dump({"format": FORMAT, **setup.to_dict()}, sort_keys=False)
    with disk_errors(data_set):
        data_set.mkdir(parents=True, exist_ok=True)
        replace_text(data_set / FILE, text)
        sync(data_set.resolve().parent)


def read_setup(data_set: Path) -> CaptureSetup:
    """Read the setup of a data set.

    Raises:
        DataSetError: when the folder is no data set, or one of a later format.
    """
    try:
        values = load_yaml(data_set / FILE)
        if values["format"] != FORMAT:
            raise DataSetError(
                f"data set '{data_set}' has format {values['format']}, and {FORMAT} is known here: update this software"
            )
        return CaptureSetup.from_dict(values)
    except (FileNotFoundError, NotADirectoryError):
        raise DataSetError(f"'{data_set}' is no data set: it has no {FILE}") from None
    except (OSError, TooMuchError, yaml.YAMLError, UnicodeDecodeError, TypeError, KeyError, SetupError) as error:
        reason = " ".join(str(error).split())
        raise DataSetError(f"'{data_set / FILE}' does not describe a data set: {reason}") from None


def restore_setup(data_set: Path) -> None:
    """Write the dataset.yaml that a data set has lost, from the setup that its episodes carry.

    Nothing happens where no episode carries one.

    Raises:
        DataSetError: when they differ. DiskError.
    """
    folders = sorted((data_set / EPISODES).glob("[!.]*"))
    found = {folder.name: setup for folder in folders if (setup := read_own_setup(folder)) is not None}
    if not found:
        return
    first, setup = next(iter(found.items()))
    for name, other in found.items():
        if differences := other.differences(setup):
            raise DataSetError(
                f"'{data_set}' has lost its {FILE}, and its episodes '{first}' and '{name}' are not of one setup "
                f"({'; '.join(differences)}): move those of one of them to a folder of their own"
            )
    write_setup(data_set, setup)
