"""Users and tokens in MongoDB. Repeated requests, after answers that were lost, lead to the same documents."""

from dataclasses import asdict

from map3d.catalogue import codec
from map3d.catalogue.account_records import TokenRecord, UserRecord, load_token, load_user
from map3d.catalogue.mongodb_connection import Document, MongoConnection
from map3d.catalogue.mongodb_documents import new_call
from map3d.errors import AlreadyExists, NotFound


class MongoAccounts:
    """The account methods of the MongoDB catalogue."""

    _connection: MongoConnection

    def create_user(self, user: UserRecord) -> None:
        document = {"_id": user.name, **asdict(user), "created_s": self._created_s(), "call": new_call()}
        if not self._connection.insert("user", document):
            raise AlreadyExists(f"user {user.name}: exists already; choose another name, or use map3d users set-password")

    def user(self, name: str) -> UserRecord:
        found = self._find_accounts("user", {"_id": name})
        if not found:
            raise NotFound(f"no user {name!r}; existing users: {codec.list_names([user.name for user in self.users()])}")
        return load_user(found[0])

    def users(self) -> list[UserRecord]:
        return [load_user(document) for document in self._find_accounts("user", {})]

    def update_user(self, user: UserRecord) -> None:
        self.user(user.name)
        change = {"$set": {"password_hash": user.password_hash, "role": user.role}}
        self._connection.run(lambda _: self._connection.collection("user").update_one({"_id": user.name}, change))

    def remove_user(self, name: str) -> None:
        """Removes the tokens last: a token without its user opens nothing."""
        self.user(name)
        self._remove_accounts("user", {"_id": name})
        self._remove_accounts("token", {"user": name})

    def create_token(self, token: TokenRecord) -> None:
        self.user(token.user)
        document = {"_id": token.id, **asdict(token), "created_s": self._created_s(), "call": new_call()}
        if not self._connection.insert("token", document):
            raise AlreadyExists(f"token {token.id}: exists already; create another one")

    def tokens(self, user: str | None = None) -> list[TokenRecord]:
        return [load_token(document) for document in self._find_accounts("token", {} if user is None else {"user": user})]

    def find_token(self, digest: str) -> TokenRecord | None:
        found = self._find_accounts("token", {"digest": digest})
        return load_token(found[0]) if found else None

    def remove_token(self, id: str) -> None:
        if not self._find_accounts("token", {"_id": id}):
            raise NotFound(f"no token {id!r}; existing tokens: {codec.list_names([token.id for token in self.tokens()])}")
        self._remove_accounts("token", {"_id": id})

    def _created_s(self) -> float:
        return self._connection.run(lambda _: self._connection.clock()).timestamp()

    def _find_accounts(self, collection: str, query: Document) -> list[Document]:
        return self._connection.run(lambda _: list(self._connection.collection(collection).find(query).sort("_id", 1)))

    def _remove_accounts(self, collection: str, query: Document) -> None:
        self._connection.run(lambda _: self._connection.collection(collection).delete_many(query))
