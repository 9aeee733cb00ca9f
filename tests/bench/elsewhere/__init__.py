"""A second simulator of joint logs, independent of the package and of the cases in `hidden`."""
