"""Link the firmware, convert it to hex, tell its size, upload it: what atmelavr does."""

from SCons.Script import Builder, Default, DefaultEnvironment

env = DefaultEnvironment()
env.Replace(
    CC="avr-gcc",
    CXX="avr-g++",
    AS="avr-gcc",
    AR="avr-gcc-ar",
    RANLIB="avr-gcc-ranlib",
    SIZETOOL="avr-size",
    PROGNAME="firmware",
    PROGSUFFIX=".elf",
    # The patterns are those of the Arduino core's platform.txt.
    SIZECHECKCMD="$SIZETOOL -A -d $SOURCES",
    SIZEPROGREGEXP=r"^(?:\.text|\.data|\.bootloader)\s+(\d+)",
    SIZEDATAREGEXP=r"^(?:\.data|\.bss|\.noinit)\s+(\d+)",
)
to_hex = Builder(
    action=env.VerboseAction("avr-objcopy -O ihex -R .eeprom $SOURCE $TARGET", "Building $TARGET"),
    suffix=".hex",
)
env.Append(BUILDERS={"ElfToHex": to_hex})
firmware = env.ElfToHex("$BUILD_DIR/${PROGNAME}", env.BuildProgram())
Default(env.Alias("buildprog", firmware))
env.AddPlatformTarget(
    "upload",
    firmware,
    [
        env.VerboseAction(".ci/need avrdude", "Looking for avrdude"),
        env.VerboseAction(env.AutodetectUploadPort, "Looking for the board"),
        # The UNO's bootloader, as in the Arduino core's boards.txt.
        env.VerboseAction(
            'avrdude -q -p atmega328p -c arduino -b 115200 -D -P "$UPLOAD_PORT" '
            "-U flash:w:$SOURCE:i",
            "Uploading $SOURCE",
        ),
    ],
    "Upload",
)
