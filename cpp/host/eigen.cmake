# Eigen comes from the system or, where Python builds us, from the package cmeel-eigen, whose
# CMake package lies in the folder cmeel.prefix on Python's path.
find_package(Python COMPONENTS Interpreter QUIET)
if(Python_FOUND)
  execute_process(
    COMMAND
      ${Python_EXECUTABLE} -c
      "import pathlib, sys; print(';'.join(str(p) for d in sys.path if (p := pathlib.Path(d or '.') / 'cmeel.prefix').is_dir()))"
    OUTPUT_VARIABLE cmeel_prefix OUTPUT_STRIP_TRAILING_WHITESPACE)
  list(APPEND CMAKE_PREFIX_PATH ${cmeel_prefix})
endif()
find_package(Eigen3 3.4 REQUIRED NO_MODULE)
