//! The bodies of the fuzz targets, and what each of them has to do at least.

mod captures;
mod checksum;
mod drive;
mod fault;
mod frame_io;
mod roles;
mod roundtrip;
mod session;
mod sim_line;
mod streams;
mod text;
mod times;

#[path = "../../../tests/harness/checked_line.rs"]
#[allow(dead_code, reason = "tests/stream uses more of it")]
mod checked_line;
#[path = "../../../tests/harness/judged_work.rs"]
#[allow(dead_code, reason = "tests/stream uses more of it")]
mod judged_work;
#[path = "../../../tests/harness/known_framings.rs"]
mod known_framings;
#[path = "../../../tests/harness/oracle.rs"]
#[allow(dead_code, reason = "tests/stream uses more of it")]
mod oracle;
#[path = "../../../tests/harness/port.rs"]
#[allow(dead_code, reason = "tests/drive uses more of it")]
mod port;

/// What a body has really done, so that a hollow one is found.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Tally {
    /// Operations performed and checked.
    pub(crate) ops: u64,
    /// Kinds of operations performed, one bit each.
    pub(crate) kinds: u64,
}

impl Tally {
    /// Counts an operation of this kind, below 64.
    pub(crate) fn did(&mut self, kind: u8) {
        self.ops += 1;
        self.kinds |= 1 << kind;
    }

    /// Counts `ops` operations of this kind; no operation is no kind.
    pub(crate) fn did_many(&mut self, kind: u8, ops: usize) {
        if ops > 0 {
            self.did(kind);
            self.ops += ops as u64 - 1;
        }
    }
}

/// A fuzz target.
pub(crate) struct Target {
    pub(crate) name: &'static str,
    pub(crate) body: fn(&[u8], &mut Tally),
    /// Number of kinds of operations.
    #[cfg_attr(not(test), allow(dead_code, reason = "only the test over the seeds asks"))]
    pub(crate) kinds: u32,
    /// Damaged copies of each seed that the test runs.
    #[cfg_attr(not(test), allow(dead_code, reason = "only the test over the seeds asks"))]
    pub(crate) copies: usize,
}

const fn target(name: &'static str, body: fn(&[u8], &mut Tally)) -> Target {
    Target { name, body, kinds: 1, copies: 4 }
}

/// All targets.
pub(crate) const ALL: &[Target] = &[
    Target { kinds: 12, ..target("ikeya_stream", streams::ikeya) },
    Target { kinds: 6, ..target("ucp_stream", streams::ucp) },
    Target { kinds: 8, ..target("captures", captures::captures) },
    Target { kinds: 6, ..target("crc16", checksum::crc16) },
    Target { kinds: 9, ..target("roundtrip", roundtrip::roundtrip) },
    Target { kinds: 7, ..target("text", text::text) },
    Target { kinds: 5, ..target("times", times::times) },
    Target { kinds: 15, ..target("ikeya_master", roles::ikeya_master) },
    Target { kinds: 10, ..target("ikeya_slave", roles::ikeya_slave) },
    Target { kinds: 14, ..target("ucp_host", roles::ucp_host) },
    Target { kinds: 11, ..target("ucp_robot", roles::ucp_robot) },
    Target { kinds: 12, ..target("frame_io", frame_io::frame_io) },
    Target { kinds: 17, copies: 1, ..target("drive_bus", drive::bus) },
    Target { kinds: 16, ..target("drive_link", drive::link) },
    Target { kinds: 7, ..target("sim_line", sim_line::sim_line) },
    Target { kinds: 28, copies: 1, ..target("session", session::session) },
];
