//! Everything that changes at run time, as one value.

use crate::clock::{Clock, Event};
use crate::life_cycle::State;
use crate::{Slave, Values};
use postcard::ser_flavors::Flavor;
use serde::{Deserialize, Serialize, de::DeserializeOwned};

/// Marks serialised states, with the version of their layout.
pub const MARK: [u8; 8] = *b"FTCFMU\0\x06";

/// Length of the checksum at the end.
const CHECKSUM: usize = size_of::<u32>();

/// Why a state cannot be written to bytes, or read from them.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum StateError {
    /// The buffer is too small.
    #[error("there is no room for the state")]
    NoRoom,
    /// The state does not fit the buffer, or cannot be written.
    #[error("the state cannot be serialised: {0}")]
    NotSerialised(postcard::Error),
    /// The bytes do not begin as a state does.
    #[error("the bytes are no state of this FMU, or of another version")]
    NoState,
    /// The checksum does not match.
    #[error("the bytes are damaged: their checksum does not match")]
    Damaged,
    /// The bytes hold something else.
    #[error("the bytes cannot be read: {0}")]
    Unreadable(postcard::Error),
    /// Another FMU's state.
    #[error("the bytes belong to the FMU with guid {0}")]
    Foreign(String),
    /// Sizes or a life cycle that this FMU does not have.
    #[error("the bytes hold no state that this FMU can be in")]
    Impossible,
}

/// Life cycle, time, values and the slave's state: what fmi2GetFMUstate saves.
///
/// The logger's switches are not part of it, and neither is the model.
#[derive(Debug, Serialize, Deserialize)]
pub struct Snapshot<T> {
    /// Where in the life cycle.
    pub phase: State,
    /// Whether fmi2SetupExperiment was called.
    pub set_up: bool,
    /// Whether values were set in initialization mode since outputs were computed.
    pub stale: bool,
    /// Whether an input could not be worked with yet at fmi2ExitInitializationMode: the first
    /// tick initializes once more.
    pub provisional: bool,
    /// Whether an input was set since the last tick began.
    pub handed_over: bool,
    /// Time.
    pub clock: Clock,
    /// Values of all variables.
    pub values: Values,
    /// The slave's own state.
    pub state: T,
}

impl<T: Clone> Clone for Snapshot<T> {
    fn clone(&self) -> Self {
        Self {
            clock: self.clock,
            values: self.values.clone(),
            state: self.state.clone(),
            ..*self
        }
    }

    /// Copies in place: nothing is allocated if `state` does not.
    fn clone_from(&mut self, source: &Self) {
        (self.phase, self.set_up) = (source.phase, source.set_up);
        (self.stale, self.provisional) = (source.stale, source.provisional);
        self.handed_over = source.handed_over;
        self.clock = source.clock;
        self.values.clone_from(&source.values);
        self.state.clone_from(&source.state);
    }
}

/// Bytes that are counted and, where there is room, written: one type for both, so that a binary holds
/// the code that serialises a state once.
struct Content<'a> {
    room: Option<&'a mut [u8]>,
    length: usize,
}

impl Flavor for Content<'_> {
    type Output = usize;

    fn try_push(&mut self, byte: u8) -> postcard::Result<()> {
        self.try_extend(&[byte])
    }

    fn try_extend(&mut self, bytes: &[u8]) -> postcard::Result<()> {
        let end = self.length + bytes.len();
        if let Some(room) = &mut self.room {
            let free = room.get_mut(self.length..end);
            free.ok_or(postcard::Error::SerializeBufferFull)?
                .copy_from_slice(bytes);
        }
        self.length = end;
        Ok(())
    }

    fn finalize(self) -> postcard::Result<usize> {
        Ok(self.length)
    }
}

impl<T> Snapshot<T> {
    /// What comes next in time; none before the first step can be made.
    pub fn upcoming(&self) -> Option<Event> {
        let before = matches!(self.phase, State::Instantiated | State::InitializationMode);
        (!before).then(|| self.clock.upcoming())
    }

    /// The state after fmi2Instantiate and after fmi2Reset.
    pub fn fresh<S: Slave<State = T>>(slave: &S) -> Self {
        Self {
            phase: State::Instantiated,
            set_up: false,
            stale: true,
            provisional: false,
            handed_over: false,
            clock: Clock::new(slave.sample_time()),
            values: Values::start(slave.variables()),
            state: slave.initial_state(),
        }
    }

    /// Writes bytes without pointers into `out`, which must have just the size they need: a mark
    /// with a version, the FMU's `guid`, the state, a checksum. Allocates nothing.
    ///
    /// # Errors
    /// A buffer of another size.
    pub fn write_bytes(&self, guid: &str, out: &mut [u8]) -> Result<(), StateError>
    where
        T: Serialize,
    {
        let end = out.len().saturating_sub(CHECKSUM);
        let (body, checksum) = out.split_at_mut(end);
        let Some((mark, content)) = body.split_at_mut_checked(MARK.len()) else {
            return Err(StateError::NoRoom);
        };
        mark.copy_from_slice(&MARK);
        self.write_content(guid, Some(content))?;
        checksum.copy_from_slice(&crc32fast::hash(body).to_le_bytes());
        Ok(())
    }

    /// The size of these bytes.
    ///
    /// # Errors
    /// A state that cannot be written.
    pub fn size_in_bytes(&self, guid: &str) -> Result<usize, StateError>
    where
        T: Serialize,
    {
        Ok(MARK.len() + self.write_content(guid, None)? + CHECKSUM)
    }

    /// Writes what stands between mark and checksum, where there is `room` for it, and returns its length.
    fn write_content(&self, guid: &str, room: Option<&mut [u8]>) -> Result<usize, StateError>
    where
        T: Serialize,
    {
        let content = Content { room, length: 0 };
        postcard::serialize_with_flavor(&(guid, self), content).map_err(StateError::NotSerialised)
    }

    /// Reads what [`Snapshot::write_bytes`] wrote.
    ///
    /// # Errors
    /// Damaged and foreign bytes.
    pub fn from_bytes<S: Slave<State = T>>(
        bytes: &[u8],
        guid: &str,
        slave: &S,
    ) -> Result<Self, StateError>
    where
        T: DeserializeOwned,
    {
        let end = bytes.len().saturating_sub(CHECKSUM);
        let (body, checksum) = bytes.split_at(end);
        let Some(content) = body.strip_prefix(&MARK) else {
            return Err(StateError::NoState);
        };
        if checksum != crc32fast::hash(body).to_le_bytes() {
            return Err(StateError::Damaged);
        }
        let ((of, snapshot), rest): ((String, Self), _) =
            postcard::take_from_bytes(content).map_err(StateError::Unreadable)?;
        if of != guid {
            return Err(StateError::Foreign(of));
        }
        let fits = snapshot.values.len() == slave.variables().len()
            && snapshot.phase.is_savable()
            && snapshot.clock.is_sound(slave.sample_time())
            && (snapshot.clock.is_at_rest() || snapshot.phase == State::Error)
            && slave.fits(&snapshot.state);
        if fits && rest.is_empty() {
            Ok(snapshot)
        } else {
            Err(StateError::Impossible)
        }
    }
}
