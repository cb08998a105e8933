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
    members: Vec<(ClientId, Role)>,
    holder: watch::Sender<Option<ClientId>>,
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
        room.members.push((client, role));
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

    /// Whether the size this client shows pictures at counts: a viewer's does only while nobody controls.
    pub(super) fn may_resize(&self) -> bool {
        let rooms = self.rooms.lock();
        let others = rooms.get(self.session.id()).is_some_and(|room| room.members.iter().any(|(_, role)| *role == Role::Control));
        self.role == Role::Control || !others
    }

    /// Makes this client the holder, whoever was it before.
    pub(super) fn take(&self) {
        self.set_holder(|_| Some(self.client));
    }

    /// Gives the control back, if this client holds it.
    pub(super) fn release(&self) {
        self.set_holder(|holder| holder.filter(|holder| *holder != self.client));
    }

    fn set_holder(&self, next: impl FnOnce(Option<ClientId>) -> Option<ClientId>) {
        if let Some(room) = self.rooms.lock().get(self.session.id()) {
            room.holder.send_if_modified(|holder| {
                let before = *holder;
                *holder = next(before);
                *holder != before
            });
        }
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        self.release();
        let mut rooms = self.rooms.lock();
        if let Some(room) = rooms.get_mut(self.session.id()) {
            room.members.retain(|(client, _)| *client != self.client);
            if room.members.is_empty() {
                rooms.remove(self.session.id());
            }
        }
        drop(rooms);
        let (session, client) = (self.session.clone(), self.client);
        if let Ok(runtime) = tokio::runtime::Handle::try_current() {
            runtime.spawn(async move { session.detach(client).await });
        }
    }
}
