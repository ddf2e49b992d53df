"""Configuration, stage and model files: YAML read with lines, checked against models, written in one step."""

from rtcomp.yamlfile.dump import dump_yaml, write_text
from rtcomp.yamlfile.load import KeyPath, YamlFile, dotted, load_yaml, parse_yaml
from rtcomp.yamlfile.validate import Section, validate

__all__ = [
    "KeyPath",
    "Section",
    "YamlFile",
    "dotted",
    "dump_yaml",
    "load_yaml",
    "parse_yaml",
    "validate",
    "write_text",
]
