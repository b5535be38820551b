"""Build a program for this computer with its own compiler."""

from SCons.Script import Default, DefaultEnvironment

env = DefaultEnvironment()
env.Replace(CC="gcc", CXX="g++", AR="gcc-ar", RANLIB="gcc-ranlib")
Default(env.Alias("buildprog", env.BuildProgram()))
