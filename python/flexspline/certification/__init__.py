"""What a device computes with an exported model, against what was promised, and its cost."""

from flexspline.certification.certifying import certify
from flexspline.certification.result import Certificate, OutputDifference

__all__ = ["Certificate", "OutputDifference", "certify"]
