from xml.etree import ElementTree

from setuptools import find_packages, setup

package_name = "cliport_benchmark"

setup(
    name=package_name,
    version=ElementTree.parse("package.xml").findtext("version"),
    packages=find_packages(exclude=["test"]),
    package_data={package_name: ["py.typed", "phrasings/*.txt", "paper_results.csv", "paper_results_test.csv"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/" + package_name]),
        ("share/" + package_name, ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="CLIPort ROS maintainers",
    maintainer_email="maintainers@cliport-ros.invalid",
    description="Data generation and evaluation of CLIPort's benchmark in the simulator.",
    license="Apache-2.0",
    tests_require=["pytest"],
    entry_points={
        "console_scripts": [
            "record = cliport_benchmark.record_cli:main",
            "generate = cliport_benchmark.generate_cli:main",
            "evaluate = cliport_benchmark.evaluate_cli:main",
            "evaluate_graph = cliport_benchmark.evaluate_graph:main",
            "demo = cliport_benchmark.demo:main",
            "bench = cliport_benchmark.bench:main",
            "card_scores = cliport_benchmark.card_scores:main",
            "results = cliport_benchmark.results:main",
            "experiment = cliport_benchmark.experiment_cli:main",
            "mounting_curve = cliport_benchmark.mounting_curve:main",
            "depth_error = cliport_benchmark.depth_error:main",
            "understanding = cliport_benchmark.understanding_cli:main",
            "gallery = cliport_benchmark.gallery_cli:main",
            "worst = cliport_benchmark.worst_cli:main",
        ]
    },
)
