from xml.etree import ElementTree

from setuptools import find_packages, setup

package_name = "sim_bridge"

setup(
    name=package_name,
    version=ElementTree.parse("package.xml").findtext("version"),
    packages=find_packages(exclude=["test"]),
    package_data={package_name: ["py.typed", "rendering/*.yaml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/" + package_name]),
        ("share/" + package_name, ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="CLIPort ROS maintainers",
    maintainer_email="maintainers@cliport-ros.invalid",
    description="PyBullet world with a Panda and one RGB-D camera, and the benchmark's tasks.",
    license="Apache-2.0",
    tests_require=["pytest"],
    entry_points={
        "console_scripts": [
            "sim = sim_bridge.node:main",
        ]
    },
)
