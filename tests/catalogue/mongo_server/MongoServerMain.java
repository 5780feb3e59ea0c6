import de.bwaldvogel.mongo.MongoServer;
import de.bwaldvogel.mongo.backend.h2.H2Backend;
import de.bwaldvogel.mongo.bson.Document;
import de.bwaldvogel.mongo.wire.message.MongoMessage;
import org.h2.mvstore.MVStore;

/** Serves the database in the file args[0] on port args[1] of the loopback interface, 0 for any; prints the port when it is ready. */
public final class MongoServerMain {
    public static void main(String[] args) {
        MVStore store = new MVStore.Builder().fileName(args[0]).autoCommitDisabled().open();
        MongoServer server = new MongoServer(new JournaledBackend(store));
        server.bind("127.0.0.1", Integer.parseInt(args[1]));
        Runtime.getRuntime().addShutdownHook(new Thread(server::shutdownNow));
        System.out.println(server.getLocalAddress().getPort());
    }

    /** Commits each request as a whole before it is answered, like a journal. A collection and its indexes are separate maps of the store, so a
     * commit in the middle of a request would leave them unequal after a kill. */
    private static final class JournaledBackend extends H2Backend {
        JournaledBackend(MVStore store) {
            super(store);
        }

        @Override
        public synchronized Document handleMessage(MongoMessage message) {
            try {
                return super.handleMessage(message);
            } finally {
                commit();
            }
        }
    }
}
