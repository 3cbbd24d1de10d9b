from xml.etree import ElementTree

from setuptools import find_packages, setup

package_name = "cliport_episodes"

setup(
    name=package_name,
    version=ElementTree.parse("package.xml").findtext("version"),
    packages=find_packages(exclude=["test"]),
    package_data={package_name: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=False,
    maintainer="CLIPort ROS maintainers",
    maintainer_email="maintainers@cliport-ros.invalid",
    description="Demonstrations as rosbag2 folders: writing, reading, editing.",
    license="Apache-2.0",
)
