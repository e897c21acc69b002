//! Packets and noise of the bus, judged many bytes at once on a host.

mod accept;
mod reject;

use super::wire::{VelocityResponse, header::READ};
use crate::stream::{Accepted, Batch, Kernel, Rejected};

/// The batches of one framing: `LONG` is the length of everything but a READ, the others say which
/// direction it finds.
#[derive(Clone, Copy, Debug)]
pub enum PacketBatch<const LONG: usize, const TO_SLAVE: bool, const TO_MASTER: bool> {}

impl<const LONG: usize, const TO_SLAVE: bool, const TO_MASTER: bool> Batch
    for PacketBatch<LONG, TO_SLAVE, TO_MASTER>
{
}

impl<const LONG: usize, const TO_SLAVE: bool, const TO_MASTER: bool> Kernel
    for PacketBatch<LONG, TO_SLAVE, TO_MASTER>
{
    #[inline(always)]
    fn reject_batch(bytes: &[u8]) -> Rejected {
        reject::reject_batch::<LONG, TO_SLAVE, TO_MASTER>(bytes)
    }

    /// None of a three-motor bus: its captures are small.
    #[inline(always)]
    fn accept_batch(bytes: &[u8], is_wide: bool) -> Accepted {
        if LONG == VelocityResponse::LEN {
            accept::accept_batch::<TO_SLAVE, TO_MASTER>(bytes, is_wide)
        } else {
            Accepted::default()
        }
    }

    #[inline(always)]
    fn is_short(bytes: &[u8]) -> bool {
        bytes.first() == Some(&READ)
    }
}
