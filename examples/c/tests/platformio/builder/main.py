from SCons.Script import Default, DefaultEnvironment

env = DefaultEnvironment()
gcc = "arm-none-eabi-gcc"
env.Replace(CC=gcc, CXX="arm-none-eabi-g++", AR="arm-none-eabi-ar", RANLIB="arm-none-eabi-ranlib",
            PROGSUFFIX=".elf")
Default(env.BuildProgram())
