//! Two worlds, one text: calls that are written once.
//!
//! A blocking call and an async one differ in the words `async` and `.await`, in the driver that
//! they belong to, and in the traits of its port and clock. A file of calls is a macro over these
//! five; `in_both_worlds` writes it for each world that is enabled.
//!
//! One async function that the blocking calls poll once would be plain code. It was tried: the
//! panic of a future that is polled after its end then stays in blocking firmware.

/// Writes the calls of a file in both worlds.
macro_rules! in_both_worlds {
    ($calls:ident) => {
        $calls! {
            Driver,
            [embedded_io::Read + embedded_io::ReadReady + embedded_io::Write],
            [Clock],
            [],
            []
        }
        #[cfg(feature = "embedded-io-async")]
        use crate::drive::asynch::Driver as AsyncDriver;
        #[cfg(feature = "embedded-io-async")]
        $calls! {
            AsyncDriver,
            [embedded_io_async::Read + embedded_io_async::Write],
            [Clock + embedded_hal_async::delay::DelayNs],
            [async],
            [.await]
        }
    };
}

/// Does something with a driver when a call ends, also if its future is dropped.
#[cfg_attr(
    not(any(feature = "ikeya", feature = "ucp")),
    allow(dead_code, reason = "only the calls of a role use it")
)]
pub(super) struct AtEnd<'a, D, F: FnMut(&mut D)> {
    pub(super) driver: &'a mut D,
    pub(super) then: F,
}

impl<D, F: FnMut(&mut D)> Drop for AtEnd<'_, D, F> {
    fn drop(&mut self) {
        (self.then)(self.driver);
    }
}
