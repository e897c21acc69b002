import os

from SCons.Script import DefaultEnvironment

env = DefaultEnvironment()
platform = env.PioPlatform().get_dir()
firmware = os.path.join(os.path.realpath(platform), "..", "..", "firmware")
machine = ["-mthumb", "-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard"]
env.Append(
    CCFLAGS=[*machine, "-Os", "-ffunction-sections", "-fdata-sections"],
    CXXFLAGS=["-std=gnu++11", "-fno-exceptions", "-fno-rtti"],
    CPPPATH=[os.path.join(platform, "core"), firmware],
    LINKFLAGS=[*machine, "-nostdlib", "-Wl,--gc-sections,--no-warn-execstack",
               "-T", os.path.join(firmware, "stm32f405.ld")],
    LIBS=["gcc"],
)
env.BuildSources("$BUILD_DIR/core", os.path.join(platform, "core"))
env.BuildSources("$BUILD_DIR/hal", firmware, "+<hal.c>")
