//! The blocking calls of a port.

use super::{Broken, Call, Fault, Port};

impl embedded_io::ErrorType for Port {
    type Error = Broken;
}

impl embedded_io::ReadReady for Port {
    fn read_ready(&mut self) -> Result<bool, Broken> {
        let mut world = self.world();
        world.calls += 1;
        Ok(world.is_readable())
    }
}

impl embedded_io::Read for Port {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Broken> {
        let mut world = self.world();
        let most = match world.next(Call::Read) {
            Fault::None => usize::MAX,
            Fault::Few(count) => usize::from(count).max(1),
            Fault::Error => return Err(Broken),
            Fault::Zero => return Ok(0),
            Fault::Late(units) => {
                world.late(units);
                usize::MAX
            }
        };
        if world.is_short && !world.is_file && !world.has_arrived() {
            return Err(Broken);
        }
        assert!(world.is_file || world.has_arrived(), "a read without a byte would block forever");
        Ok(world.give(buffer, most))
    }
}

impl embedded_io::Write for Port {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Broken> {
        assert!(!bytes.is_empty(), "nothing to write");
        let mut world = self.world();
        let most = match world.next(Call::Write) {
            Fault::None => usize::MAX,
            Fault::Few(count) => usize::from(count).max(1),
            Fault::Error => return Err(Broken),
            Fault::Zero => 0,
            Fault::Late(units) => {
                world.late(units);
                usize::MAX
            }
        };
        Ok(world.take(bytes, most))
    }

    fn flush(&mut self) -> Result<(), Broken> {
        let mut world = self.world();
        world.flushes += 1;
        match world.next(Call::Flush) {
            Fault::Error | Fault::Zero => return Err(Broken),
            Fault::Late(units) => world.late(units),
            Fault::None | Fault::Few(_) => {}
        }
        world.flushed();
        Ok(())
    }
}
