//! Objects in memory of the caller, and what can be checked of a pointer.

use core::{
    mem::MaybeUninit,
    slice,
    sync::atomic::{AtomicU32, Ordering, compiler_fence},
};

use crate::result::{
    AXLE_ERROR_ALIGNMENT, AXLE_ERROR_BUSY, AXLE_ERROR_NOT_INITIALIZED, AXLE_ERROR_NULL,
    AXLE_ERROR_OVERLAP, AXLE_ERROR_SIZE, AXLE_ERROR_TOO_LONG, AXLE_ERROR_VALUE, AXLE_NONE, AXLE_OK,
    axle_result,
};

/// A type of the header: memory for an object.
pub(crate) trait Memory: Sized {
    /// What is in it.
    type Value;

    /// Tells it from other objects, and from memory that was never initialised.
    const MAGIC: u32;
}

/// What is in the memory.
#[repr(C)]
pub(crate) struct Object<V> {
    state: AtomicU32,
    value: MaybeUninit<V>,
}

/// Declares memory for an object, with its size in the header.
macro_rules! object {
    ($(#[$doc:meta])* $name:ident, $size:ident = $bytes:literal, $words:literal words of $value:ty, $magic:literal) => {
        /// Size of the object, bytes.
        pub const $size: usize = $bytes;

        $(#[$doc])*
        #[repr(C)]
        #[derive(Debug)]
        pub struct $name {
            /// Private.
            memory: [u64; $words],
        }

        impl crate::memory::Memory for $name {
            type Value = $value;
            const MAGIC: u32 = u32::from_le_bytes(*$magic);
        }

        const _: () = {
            let needs = size_of::<crate::memory::Object<$value>>();
            assert!(size_of::<$name>() == $size && align_of::<$name>() >= align_of::<$value>());
            // No larger than needed where it is tested.
            assert!(needs <= $size && (needs == $size || cfg!(not(target_pointer_width = "64"))));
        };
    };
}

/// Puts a value into the memory, which has this size in the view of the caller.
///
/// What is there before is not looked at: it may be anything, even what a processor left behind
/// that was reset during a call.
pub(crate) fn init<M: Memory>(
    memory: *mut M,
    size: usize,
    value: impl FnOnce() -> Result<M::Value, axle_result>,
) -> axle_result {
    let object = match checked::<M>(memory) {
        Ok(object) => object,
        Err(error) => return error,
    };
    if size != size_of::<M>() {
        return AXLE_ERROR_SIZE;
    }
    match value() {
        Ok(value) => {
            let (state, value) = (AtomicU32::new(M::MAGIC), MaybeUninit::new(value));
            // SAFETY: `checked` has seen that the pointer is aligned and not null. The memory is
            // the caller's, of the size of an object; nobody else uses it, as the caller promises.
            unsafe { object.write(Object { state, value }) };
            AXLE_OK
        }
        Err(error) => error,
    }
}

/// Calls a function with the object in the memory, and keeps other calls out meanwhile.
#[inline]
pub(crate) fn enter<M: Memory, R>(
    memory: *const M,
    function: impl FnOnce(&mut M::Value) -> R,
) -> Result<R, axle_result> {
    let object = checked(memory.cast_mut())?;
    // SAFETY: `checked` has seen that the pointer is aligned and not null. The memory is the
    // caller's, of the size of an object, and a number in it has no invalid values.
    let state = unsafe { &(*object).state };
    match state.load(Ordering::Relaxed) {
        known if known == M::MAGIC => {}
        known if known == busy::<M>() => return Err(AXLE_ERROR_BUSY),
        _ => return Err(AXLE_ERROR_NOT_INITIALIZED),
    }
    state.store(busy::<M>(), Ordering::Relaxed);
    compiler_fence(Ordering::SeqCst);
    // SAFETY: as above. While the state is busy no other call uses the value: not in an interrupt,
    // as it would see the state, and not in another thread, as the caller promises.
    let value = unsafe { &mut (*object).value };
    // SAFETY: the magic number was written by `init`, with the value.
    let value = unsafe { value.assume_init_mut() };
    let result = function(value);
    compiler_fence(Ordering::SeqCst);
    state.store(M::MAGIC, Ordering::Relaxed);
    Ok(result)
}

/// The same with bytes of the caller, which must not be in the memory of the object.
#[inline]
pub(crate) fn enter_with<M: Memory, R>(
    memory: *const M,
    data: *const u8,
    length: usize,
    function: impl FnOnce(&mut M::Value, &[u8]) -> R,
) -> Result<R, axle_result> {
    let bytes = bytes(data, length)?;
    apart(bytes, memory.cast(), size_of::<M>())?;
    enter(memory, |value| function(value, bytes))
}

/// Checks that bytes are not in this other memory.
pub(crate) fn apart(bytes: &[u8], other: *const u8, size: usize) -> Result<(), axle_result> {
    let (start, from) = (bytes.as_ptr().addr(), other.addr());
    let meet = start < from.saturating_add(size) && from < start.saturating_add(bytes.len());
    if meet && !bytes.is_empty() && !other.is_null() { Err(AXLE_ERROR_OVERLAP) } else { Ok(()) }
}

const fn busy<M: Memory>() -> u32 {
    !M::MAGIC
}

#[inline]
fn checked<M: Memory>(memory: *mut M) -> Result<*mut Object<M::Value>, axle_result> {
    const { assert!(size_of::<Object<M::Value>>() <= size_of::<M>()) };
    aligned(memory)?;
    Ok(memory.cast())
}

#[inline]
fn aligned<T>(pointer: *const T) -> Result<(), axle_result> {
    if pointer.is_null() {
        Err(AXLE_ERROR_NULL)
    } else if !pointer.addr().is_multiple_of(align_of::<T>()) {
        Err(AXLE_ERROR_ALIGNMENT)
    } else {
        Ok(())
    }
}

/// Bytes of the caller. None may be null.
#[inline]
pub(crate) fn bytes<'a>(data: *const u8, length: usize) -> Result<&'a [u8], axle_result> {
    if length == 0 {
        return Ok(&[]);
    }
    aligned(data)?;
    if length > isize::MAX as usize {
        return Err(AXLE_ERROR_TOO_LONG);
    }
    // SAFETY: not null, not too long; the caller promises that it points to so many bytes, which
    // nobody changes during the call.
    Ok(unsafe { slice::from_raw_parts(data, length) })
}

/// Bytes that the caller wants to have written.
pub(crate) fn bytes_mut<'a>(data: *mut u8, length: usize) -> Result<&'a mut [u8], axle_result> {
    if length == 0 {
        return Ok(&mut []);
    }
    aligned(data)?;
    if length > isize::MAX as usize {
        return Err(AXLE_ERROR_TOO_LONG);
    }
    // SAFETY: not null, not too long; the caller promises that it points to so many bytes, which
    // nobody else uses during the call.
    Ok(unsafe { slice::from_raw_parts_mut(data, length) })
}

/// A value of the caller, of which every bit pattern is valid.
#[inline]
pub(crate) fn read<T: Copy + Plain>(from: *const T) -> Result<T, axle_result> {
    aligned(from)?;
    // SAFETY: aligned and not null; the caller promises that it points to such a value, and all
    // bytes are valid for it.
    Ok(unsafe { from.read() })
}

/// Types of numbers and pointers alone.
///
/// # Safety
///
/// Every bit pattern is a valid value.
pub(crate) unsafe trait Plain {}

macro_rules! plain {
    ($($type:ty),* $(,)?) => {
        $(
            // SAFETY: its fields are numbers and pointers.
            unsafe impl crate::memory::Plain for $type {}
        )*
    };
}
plain!(u8, usize, u64, f32, *const u8);

/// Where to write values, at least one.
pub(crate) fn slots<'a, T>(
    to: *mut T,
    capacity: usize,
) -> Result<&'a mut [MaybeUninit<T>], axle_result> {
    aligned(to)?;
    if capacity == 0 {
        return Err(AXLE_ERROR_VALUE);
    }
    if capacity > isize::MAX as usize / size_of::<T>() {
        return Err(AXLE_ERROR_TOO_LONG);
    }
    // SAFETY: aligned, not null, not too long; the caller promises that so many values can be
    // written there, and that nobody else uses them during the call.
    Ok(unsafe { slice::from_raw_parts_mut(to.cast(), capacity) })
}

/// Where to write an output: checked before anything is done.
pub(crate) struct Out<T>(*mut T);

impl<T> Out<T> {
    #[inline]
    pub(crate) fn new(to: *mut T) -> Result<Self, axle_result> {
        aligned(to)?;
        Ok(Self(to))
    }

    /// The place itself.
    #[inline]
    pub(crate) fn slot<'a>(self) -> &'a mut MaybeUninit<T> {
        // SAFETY: aligned and not null; the caller promises that a value can be written there, and
        // that nobody else uses it during the call.
        unsafe { &mut *self.0.cast() }
    }

    #[inline]
    pub(crate) fn write(self, value: T) -> axle_result {
        // SAFETY: aligned and not null; the caller promises that a value can be written there.
        unsafe { self.0.write(value) };
        AXLE_OK
    }
}

/// Writes what a function finds in an object, or says that there is nothing.
#[inline]
pub(crate) fn get<M: Memory, T>(
    role: *const M,
    to: *mut T,
    of: impl FnOnce(&mut M::Value) -> Option<T>,
) -> axle_result {
    let get = || {
        let out = Out::new(to)?;
        Ok(enter(role, of)?.map_or(AXLE_NONE, |value| out.write(value)))
    };
    get().unwrap_or_else(|error| error)
}
