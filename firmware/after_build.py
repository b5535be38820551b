"""PlatformIO's hook: check the size of what was just linked."""

from SCons.Script import DefaultEnvironment

DefaultEnvironment().AddPostAction(
    "$BUILD_DIR/${PROGNAME}.elf", '"$PYTHONEXE" firmware/check_size.py $TARGET'
)
