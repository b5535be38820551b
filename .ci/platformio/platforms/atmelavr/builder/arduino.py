"""Compile the Arduino core with the options of its own platform.txt.

PlatformIO runs this after it has read the project's flags, as it does with its own
platform: a -std= in build_flags without the build_unflags loses here too.
"""

from pathlib import Path

from SCons.Script import DefaultEnvironment

env = DefaultEnvironment()
build = env.BoardConfig().get("build")
root = Path(env.PioPlatform().get_package_dir("framework-arduino-avr"))
core = str(root / "cores" / build["core"])
machine = [f"-mmcu={build['mcu']}"]

env.Append(
    ASPPFLAGS=[*machine, "-x", "assembler-with-cpp"],
    CFLAGS=["-std=gnu11", "-fno-fat-lto-objects"],
    CXXFLAGS=["-fno-exceptions", "-fno-threadsafe-statics", "-fpermissive", "-std=gnu++11"],
    CCFLAGS=[*machine, "-Os", "-Wall", "-ffunction-sections", "-fdata-sections", "-flto"],
    LINKFLAGS=[*machine, "-Os", "-Wl,--gc-sections", "-flto", "-fuse-linker-plugin"],
    LIBS=["m"],
    CPPDEFINES=[("F_CPU", build["f_cpu"]), "ARDUINO_ARCH_AVR", ("ARDUINO", 10808)],
    CPPPATH=[core, str(root / "variants" / build["variant"])],
    LIBSOURCE_DIRS=[str(root / "libraries")],
)
env.Prepend(LIBS=[env.BuildLibrary(str(Path("$BUILD_DIR") / "FrameworkArduino"), core)])
