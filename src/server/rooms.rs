//! Who is connected to a session, and who holds its control.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::watch;

use crate::engine::{ClientId, Session};

/// What a client may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    /// Look and change.
    Control,
    /// Look.
    View,
}

impl Role {
    /// The word in `hello` and `welcome`.
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Control => "control",
            Self::View => "view",
        }
    }
}

/// The rooms of all sessions that have clients.
#[derive(Default)]
pub(super) struct Rooms(Mutex<HashMap<String, Room>>);

struct Room {
    /// Who told a size last stands last.
    members: Vec<Member>,
    holder: watch::Sender<Option<ClientId>>,
}

struct Member {
    client: ClientId,
    role: Role,
    size: Option<[u32; 2]>,
}

impl Room {
    fn hold(&self, next: Option<ClientId>) {
        self.holder.send_if_modified(|holder| std::mem::replace(holder, next) != next);
    }

    fn release(&self, client: ClientId) {
        if *self.holder.borrow() == Some(client) {
            self.hold(None);
        }
    }

    /// Whose size the pictures have: the holder's, or that of the client who told one last. A viewer's counts only while
    /// nobody controls.
    fn shaper(&self) -> Option<(ClientId, [u32; 2])> {
        let holder = *self.holder.borrow();
        let controlled = self.members.iter().any(|member| member.role == Role::Control);
        let counts = |member: &&Member| {
            holder.is_none_or(|holder| holder == member.client) && (member.role == Role::Control || !controlled)
        };
        self.members.iter().rev().filter(counts).find_map(|member| Some((member.client, member.size?)))
    }
}

/// A client's place in a room; dropping it leaves the room, gives control back and tells the session.
pub(super) struct Seat {
    rooms: Arc<Rooms>,
    session: Session,
    client: ClientId,
    role: Role,
    holder: watch::Receiver<Option<ClientId>>,
}

impl Rooms {
    fn lock(&self) -> MutexGuard<'_, HashMap<String, Room>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Seats a client in the room of a session.
    pub(super) fn enter(self: &Arc<Self>, session: Session, client: ClientId, role: Role) -> Seat {
        let mut rooms = self.lock();
        let room = rooms
            .entry(session.id().to_owned())
            .or_insert_with(|| Room { members: Vec::new(), holder: watch::Sender::new(None) });
        room.members.push(Member { client, role, size: None });
        let holder = room.holder.subscribe();
        drop(rooms);
        Seat { rooms: Arc::clone(self), session, client, role, holder }
    }

    /// Clients in the room of a session.
    pub(super) fn count(&self, session: &str) -> usize {
        self.lock().get(session).map_or(0, |room| room.members.len())
    }
}

impl Seat {
    /// Who holds the control, and every change of it.
    pub(super) fn holder(&self) -> watch::Receiver<Option<ClientId>> {
        self.holder.clone()
    }

    /// Whether this client may change something now; the code and words of the refusal otherwise.
    pub(super) fn may_change(&self) -> Result<(), (&'static str, &'static str)> {
        match *self.holder.borrow() {
            _ if self.role == Role::View => Err(("view_only", "this client only looks; its role is view")),
            Some(holder) if holder != self.client => Err(("not_holder", "another client holds the control")),
            _ => Ok(()),
        }
    }

    /// Takes note of the size that this client shows pictures at; whether it counts now.
    pub(super) fn tell_size(&self, size: [u32; 2]) -> Result<(), (&'static str, &'static str)> {
        let mut rooms = self.rooms.lock();
        let Some(room) = rooms.get_mut(self.session.id()) else { return Ok(()) };
        room.members.retain(|member| member.client != self.client);
        room.members.push(Member { client: self.client, role: self.role, size: Some(size) });
        match room.shaper() {
            Some((client, _)) if client == self.client => Ok(()),
            _ if self.role == Role::View => Err(("view_only", "a viewer's size counts only while nobody controls")),
            _ => Err(("not_holder", "another client holds the control")),
        }
    }

    /// Makes this client the holder, whoever was it before.
    pub(super) fn take(&self) {
        if let Some(room) = self.rooms.lock().get(self.session.id()) {
            room.hold(Some(self.client));
        }
    }

    /// Gives the control back, if this client holds it.
    pub(super) fn release(&self) {
        if let Some(room) = self.rooms.lock().get(self.session.id()) {
            room.release(self.client);
        }
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        let shaper = self.leave();
        let (session, client) = (self.session.clone(), self.client);
        let Ok(runtime) = tokio::runtime::Handle::try_current() else { return };
        runtime.spawn(async move {
            session.detach(client).await;
            if let Some((client, size)) = shaper {
                session.resize(client, size).await;
            }
        });
    }
}

impl Seat {
    /// Leaves the room; whose size the pictures have from now on, if it was this client's.
    fn leave(&self) -> Option<(ClientId, [u32; 2])> {
        let mut rooms = self.rooms.lock();
        let room = rooms.get_mut(self.session.id())?;
        let before = room.shaper();
        room.members.retain(|member| member.client != self.client);
        room.release(self.client);
        let after = room.shaper();
        if room.members.is_empty() {
            rooms.remove(self.session.id());
        }
        after.filter(|_| before.is_some_and(|(client, _)| client == self.client))
    }
}
