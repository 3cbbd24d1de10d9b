from xml.etree import ElementTree

from setuptools import setup

package_name = "cliport_example_task"

setup(
    name=package_name,
    version=ElementTree.parse("package.xml").findtext("version"),
    packages=[package_name],
    package_data={package_name: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/" + package_name]),
        ("share/" + package_name, ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="CLIPort ROS maintainers",
    maintainer_email="maintainers@cliport-ros.invalid",
    description="An example of a task that is added to CLIPort's benchmark by a package of its own.",
    license="Apache-2.0",
    # the whole registration: the task's name, and what makes it
    entry_points={"sim_bridge.tasks": ["put-block-on-mat = cliport_example_task.put_block_on_mat:PutBlockOnMat"]},
)
