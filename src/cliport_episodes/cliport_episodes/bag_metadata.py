"""metadata.yaml of an episode, version 9 as Jazzy writes it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml
from rosbags.rosbag2.metadata import dump_qos_v9

from cliport_core.bag_limits import TooMuchError, load_yaml
from cliport_episodes.bag_file import BagFile, BagTopic
from cliport_episodes.disk import replace_text
from cliport_episodes.errors import BagError, NoMetadataError

FILE = "metadata.yaml"
_INFORMATION = "rosbag2_bagfile_information"
_DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)  # ten times as fast, where there is it


def write_metadata(folder: Path, files: Sequence[BagFile], custom_data: Mapping[str, str]) -> None:
    """Replace an episode's metadata.yaml. Raises OSError when the disk refuses; the old one is whole then."""
    start = min((file.start_ns for file in files), default=0)
    end = max((file.end_ns for file in files), default=0)
    information = {
        "version": 9,
        "storage_identifier": "mcap",
        "duration": {"nanoseconds": end - start},
        "starting_time": {"nanoseconds_since_epoch": start},
        "message_count": sum(file.count for file in files),
        "topics_with_message_count": _topics(files),
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file.name for file in files],
        "files": [
            {
                "path": file.name,
                "starting_time": {"nanoseconds_since_epoch": file.start_ns},
                "duration": {"nanoseconds": file.end_ns - file.start_ns},
                "message_count": file.count,
            }
            for file in files
        ],
        "custom_data": dict(custom_data),
        "ros_distro": "jazzy",
    }
    text = yaml.dump({_INFORMATION: information}, Dumper=_DUMPER, sort_keys=False, allow_unicode=True)
    replace_text(folder / FILE, text)


def read_custom_data(folder: Path) -> dict[str, str]:
    """Read the `custom_data` of a bag; empty where it has none.

    Raises:
        NoMetadataError: when metadata.yaml is missing.
        BagError: when it cannot be read as one.
    """
    try:
        document = load_yaml(folder / FILE)
        custom_data = document[_INFORMATION]["custom_data"] or {}
        return {str(key): str(value) for key, value in custom_data.items()}
    except FileNotFoundError:
        raise NoMetadataError(f"{FILE} is missing") from None
    except TooMuchError as error:
        raise BagError(f"{FILE} is not read: {error}") from None
    except (OSError, yaml.YAMLError, UnicodeDecodeError, KeyError, TypeError, AttributeError) as error:
        raise BagError(f"{FILE} cannot be read ({type(error).__name__})") from None


def _topics(files: Sequence[BagFile]) -> list[dict[str, Any]]:
    counts: dict[BagTopic, int] = {}
    for file in files:
        for topic in file.topics:
            key = BagTopic(topic.name, topic.type, topic.type_hash, topic.offers, 0)
            counts[key] = counts.get(key, 0) + topic.count
    return [
        {
            "topic_metadata": {
                "name": topic.name,
                "type": topic.type,
                "serialization_format": "cdr",
                "offered_qos_profiles": dump_qos_v9(list(topic.offers)),
                "type_description_hash": topic.type_hash,
            },
            "message_count": count,
        }
        for topic, count in sorted(counts.items(), key=lambda item: item[0].name)
    ]
