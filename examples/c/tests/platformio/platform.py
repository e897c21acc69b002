from platformio.platform.base import PlatformBase


class AxleqemuPlatform(PlatformBase):
    pass
